"""Files and first contact: start page, drops, imports, recovery, and what is told when something fails."""
