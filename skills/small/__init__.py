"""Skills of one page each: doors, dock, costmap, finding the pose again, backing off and speaking."""
