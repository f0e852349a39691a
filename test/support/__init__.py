"""Small models and oracles for the tests; nothing here uses the code under test except `robot_of`."""
