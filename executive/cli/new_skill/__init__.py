"""`errand new-skill`: an installable package with one skill, its tests and its registration."""
