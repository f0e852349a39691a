"""The measured motion as smooth functions of time, and the times at which filters step."""
