"""Speech: from sound to words."""
