"""The paper's figures, reproduced: each drawn, and held to the numbers that it must show."""
