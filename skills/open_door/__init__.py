"""The open_door skill, and plug-ins that open doors."""
