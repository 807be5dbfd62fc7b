"""The clear_costmap skill."""
