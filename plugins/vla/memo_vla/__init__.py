"""Vision-language-action policies as a method, demonstrations for training them, and datasets in LeRobot's format."""
