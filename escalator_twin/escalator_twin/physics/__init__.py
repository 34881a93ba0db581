"""Mechanics of a long-link escalator chain: MuJoCo hosts the state, one compiled law the forces."""
