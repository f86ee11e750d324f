"""From masks and depth to poses, boxes and states: everything metric, without a model."""
