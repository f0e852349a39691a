"""Headless Chromium over its DevTools pipe: pages opened, asked, and watched for errors.

Nothing but the browser itself is needed; where it is not installed a test skips and says so.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser')
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="Debian's package chromium is not installed: no page is opened"
)


class Browser:
    """One Chromium without a network; `with` ends it."""

    def __init__(self) -> None:
        # what Chromium's children still write when it was killed is left to the system
        self._profile = tempfile.TemporaryDirectory(
            prefix='spacerobot-chromium-', ignore_cleanup_errors=True
        )
        down, self._write = os.pipe()
        self._read, up = os.pipe()
        arguments = [
            *(str(CHROMIUM), '--headless=new', '--no-sandbox', '--remote-debugging-pipe'),
            *('--enable-unsafe-swiftshader', '--use-angle=swiftshader', '--disable-gpu-sandbox'),
            *('--no-first-run', '--disable-extensions', '--host-resolver-rules=MAP * 0.0.0.0'),
            *(f'--user-data-dir={self._profile.name}', 'about:blank'),
        ]
        # Chromium reads commands on descriptor 3 and answers on 4
        script = f'exec 3<&{down} 4>&{up}; exec "$@"'
        self._process = subprocess.Popen(
            ['bash', '-c', script, 'bash', *arguments],
            pass_fds=(down, up),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(down)
        os.close(up)
        self._buffer, self._count, self._session = b'', 0, None
        self.errors: list[str] = []
        target = self._ask('Target.createTarget', url='about:blank')['targetId']
        attached = self._ask('Target.attachToTarget', targetId=target, flatten=True)
        self._session = attached['sessionId']
        for domain in ('Page', 'Runtime', 'Log'):
            self._ask(f'{domain}.enable')

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)
        self._profile.cleanup()

    def open(
        self, path: Path, width: int = 1200, scheme: str = 'light', media: str = 'screen'
    ) -> None:
        """Load a page and wait until its scripts have run, and it is as a medium shows it."""
        self.errors.clear()
        metrics = {'width': width, 'height': 900, 'deviceScaleFactor': 1, 'mobile': width < 600}
        self._ask('Emulation.setDeviceMetricsOverride', **metrics)
        features = [{'name': 'prefers-color-scheme', 'value': scheme}]
        self._ask('Emulation.setEmulatedMedia', media='screen', features=features)
        self._ask('Page.navigate', url=path.resolve().as_uri())
        self.ask(
            'new Promise((done) => {'
            ' const ready = () => requestAnimationFrame(() => requestAnimationFrame(done));'
            " if (document.readyState === 'complete') ready();"
            " else addEventListener('load', ready);"
            '}).then(() => location.href)'
        )
        if media != 'screen':
            self._ask('Emulation.setEmulatedMedia', media=media, features=features)
            self.ask('new Promise((done) => requestAnimationFrame(() => done(0)))')

    def ask(self, expression: str) -> Any:
        """Value of a JavaScript expression, awaited where it is a promise."""
        answer = self._ask(
            'Runtime.evaluate', expression=expression, awaitPromise=True, returnByValue=True
        )
        if 'exceptionDetails' in answer:
            raise AssertionError(json.dumps(answer['exceptionDetails'])[:600])
        return answer['result'].get('value')

    def drag(self, *places: tuple[float, float]) -> None:
        """Move the mouse along places of the window, the button held between first and last."""
        for k, (x, y) in enumerate(places):
            self._mouse('mouseMoved', x, y, int(k > 0))
            if k == 0 and len(places) > 1:
                self._mouse('mousePressed', x, y, 1)
        if len(places) > 1:
            self._mouse('mouseReleased', *places[-1], 1)
        self.ask('new Promise((done) => requestAnimationFrame(() => done(0)))')

    def _mouse(self, kind: str, x: float, y: float, buttons: int) -> None:
        more = {} if kind == 'mouseMoved' else {'button': 'left', 'clickCount': 1}
        self._ask('Input.dispatchMouseEvent', type=kind, x=x, y=y, buttons=buttons, **more)

    def picture(self, path: Path, selector: str) -> None:
        """Save what an element looks like."""
        box = self.ask(f'document.querySelector({selector!r}).getBoundingClientRect().toJSON()')
        clip = {**{key: box[key] for key in ('x', 'y', 'width', 'height')}, 'scale': 1}
        shot = self._ask('Page.captureScreenshot', format='png', clip=clip)
        path.write_bytes(base64.b64decode(shot['data']))

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        self._count += 1
        message: dict[str, Any] = {'id': self._count, 'method': method, 'params': params}
        if self._session is not None:
            message['sessionId'] = self._session
        os.write(self._write, json.dumps(message).encode() + b'\0')
        while True:
            answer = self._next()
            if answer.get('id') == self._count:
                assert 'error' not in answer, answer
                return answer['result']
            self._note(answer)

    def _next(self) -> dict[str, Any]:
        while b'\0' not in self._buffer:
            part = os.read(self._read, 1 << 20)
            assert part, 'Chromium has ended'
            self._buffer += part
        message, _, self._buffer = self._buffer.partition(b'\0')
        return json.loads(message)

    def _note(self, event: dict[str, Any]) -> None:
        """Keep what went wrong on the page."""
        method, params = event.get('method'), event.get('params', {})
        if method == 'Runtime.exceptionThrown':
            details = params['exceptionDetails']
            self.errors.append(details.get('exception', details).get('description', 'exception'))
        elif method == 'Runtime.consoleAPICalled' and params['type'] in ('error', 'assert'):
            self.errors.append(' '.join(str(a.get('value')) for a in params['args']))
        elif method == 'Log.entryAdded' and params['entry']['level'] == 'error':
            self.errors.append(params['entry']['text'])
