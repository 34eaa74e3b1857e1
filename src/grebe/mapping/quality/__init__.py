"""Quality control of readings: QARTOD's tests, and tests specific to a survey boat."""
