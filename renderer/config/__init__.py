"""The config: the parameter table, the tuned config file, and the learnt prior it may hold."""
