"""Job three: a library of scenes in, a record and a tuned config for each out."""
