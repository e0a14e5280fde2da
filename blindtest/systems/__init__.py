"""The machines of the generator: own equations, effects in their true form; native/*.c computes them."""
