"""The hand_over skill."""
