"""The trial of a robot that ``memo plugins check robot`` runs."""
