"""What each reading is worth: QARTOD's tests, and a survey boat's own."""
