"""A model that lacks what the program needs: it is refused by name when somebody asks for it."""


class Unfinished:
    """Has a name and nothing else."""

    id = "unfinished"
    label = "Unfinished"


MODEL = Unfinished()
