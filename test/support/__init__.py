"""Small models, oracles and rigs for the tests."""
