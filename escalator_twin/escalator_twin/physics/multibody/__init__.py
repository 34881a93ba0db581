"""Chains of free planar bodies: contact law, guides, forces, MuJoCo model, runs."""
