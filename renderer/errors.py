"""The two ways a command fails that a user can do something about."""


class InputError(ValueError):
    """Something the user gave cannot be used: exit code 2.

    The message is one line naming the file or key, the rule, and the value got.
    """


class MachineError(RuntimeError):
    """This machine lacks something the command needs: exit code 3.

    The message is one line naming what is missing and the command that mends it.
    """
