"""Laws that a robot file writes or a recording teaches: formulas, learned torques."""
