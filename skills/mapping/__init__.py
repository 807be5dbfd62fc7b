"""Maps that the robot makes itself: scan matching, pose graph, occupancy, exploration."""
