"""Reports: tables, figures and one page about an experiment, or about one run."""
