"""A policy server without a network: it plays the demonstration of a dataset that is most like what it is shown."""
