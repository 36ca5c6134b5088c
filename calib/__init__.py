"""Truth for the fingertip: simulated and real rigs, the paper's protocols, fit, evaluation, report."""
