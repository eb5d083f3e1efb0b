"""The learned descriptor: towns and halls in short bursts, a network trained on them, its weights.

Nothing of it is needed to use the descriptor, which is `evplace.scorers.trained`.
"""
