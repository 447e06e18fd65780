"""The paper's experiments: each returns data (trials, spreads, recordings), none draws."""
