import asyncio
async def f():
    move_to([0.4, 0.0, 0.3])
asyncio.run(f())
