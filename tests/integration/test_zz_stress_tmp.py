import asyncio, os, signal, sys, pytest, msgspec
from tests.integration.test_tuning import *
from tests.conftest import wait_alive

@pytest.mark.timeout(300)
async def test_stress(open_as, private_sets, perception):
    obs = await open_as("observer")
    args=[w for s in private_sets for w in ("--set",s)]
    for i in range(25):
        p = await asyncio.create_subprocess_exec(sys.executable,"-X","faulthandler","-m","paani","advisor",*args,stderr=asyncio.subprocess.PIPE)
        await wait_alive(obs,"advisor",p)
        await asyncio.sleep(0.3+0.013*i)
        p.terminate()
        try:
            async with asyncio.timeout(6): await p.wait()
        except TimeoutError:
            p.send_signal(signal.SIGABRT)
            out=(await p.stderr.read()).decode()
            print("HUNG",i,out[-3500:]); 
            raise AssertionError
