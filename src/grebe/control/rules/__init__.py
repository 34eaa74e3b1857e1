"""Rules: from where the boat is and what lies ahead to the stages of a horizon."""
