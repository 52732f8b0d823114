"""What every other room stands on: arrays, the torus, threads, progress, tables, files."""
