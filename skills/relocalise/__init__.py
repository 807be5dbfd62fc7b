"""The relocalise skill."""
