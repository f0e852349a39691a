"""Published experiments repeated, each beside the figures that its paper prints."""
