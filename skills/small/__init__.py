"""Short skills, one module each: doors, dock, costmap, relocalisation, backing off and speaking."""
