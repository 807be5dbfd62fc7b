"""Maps that the robot makes: scan matching, pose graph, occupancy, exploration."""
