"""LIBERO and LIBERO-PRO as a simulator, a task suite and a robot of MEMO, in a process of their own."""
