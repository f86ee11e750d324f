"""The suite ``house-rules``: tasks with a rule of a house or its people, which neither the scene nor trying reveals."""
