"""What is measured on the way: when a reading is due, and where it belongs."""
