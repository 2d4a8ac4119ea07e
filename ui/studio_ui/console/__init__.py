"""The scripting console: a prompt in a panel, completion, and a way to stop what runs for long."""
