"""The database: tables, connections, queries, recovery, and where entries come from."""
