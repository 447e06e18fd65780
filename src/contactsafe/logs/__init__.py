"""What robots recorded: reading their logs, and what the estimator makes of them."""
