"""A dask cluster on which jobs run: encrypted, or on this machine, or in the clear where that is asked for."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from toolkit.errors import InputError, WorkerError

_ENCRYPTED = ("tls", "wss")
_PATIENCE = "20s"  # for a scheduler to answer


@contextmanager
def cluster_executor(address: str, *, unencrypted: bool = False) -> Iterator[Executor]:
    """The workers of a cluster.

    Dask sends code. Whoever can reach or pretend to be a scheduler without TLS can run programs on every machine that
    is connected to it. The certificates of `tls://` are those of dask's own settings, `distributed.comm.tls`.

    Args:
        address: The scheduler, `tls://HOST:PORT`; on this machine also `tcp://HOST:PORT` or `HOST:PORT`.
        unencrypted: Whether a scheduler elsewhere may be used without encryption.

    Raises:
        InputError: Dask is not installed, the cluster does not answer, or it is elsewhere and not encrypted.
        WorkerError: Several workers died over the same job.
    """
    try:
        from dask.config import get as setting
        from distributed import Client
        from distributed.comm.addressing import parse_host_port
        from distributed.scheduler import KilledWorker
        from distributed.security import Security
    except ImportError:
        raise InputError("--cluster needs dask: pip install -e '.[cluster]'") from None
    scheme, mark, place = address.rpartition("://")
    scheme = scheme if mark else str(setting("distributed.comm.default-scheme", "tcp"))
    try:
        host, _ = parse_host_port(place)
    except ValueError as error:
        raise InputError(f"--cluster {address}: {error}; give tls://HOST:PORT") from None
    security = Security()
    if scheme in _ENCRYPTED:
        try:
            ready = security.get_connection_args("client").get("ssl_context") is not None
        except OSError as error:
            raise InputError(f"--cluster {address}: the certificates of dask cannot be read ({error})") from None
        if not ready:
            raise InputError(
                f"--cluster {address}: no certificates; name them in dask's settings or in the environment, "
                "DASK_DISTRIBUTED__COMM__TLS__CA_FILE and DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT and ...__KEY"
            )
    elif not unencrypted and not _is_here(host):
        raise InputError(
            f"--cluster {address}: is another machine and the connection is not encrypted, so that anyone in the "
            "network could run programs here and on the workers; give tls://HOST:PORT, or --cluster-unencrypted in a "
            "network that you trust"
        )
    try:
        client = Client(f"{scheme}://{place}", timeout=_PATIENCE, security=security)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"--cluster {address}: no dask scheduler answers there ({reason})") from None
    try:
        with client, client.get_executor(pure=False) as pool:
            yield pool
    except KilledWorker as error:
        raise WorkerError(
            f"--cluster {address}: a job ended several workers ({' '.join(str(error).split())})"
        ) from None


def _is_here(host: str) -> bool:
    """Whether a host is this machine: its addresses can be bound. A name that nobody knows is nowhere else."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except OSError:
        return True
    for family, kind, protocol, _, place in found:
        with socket.socket(family, kind, protocol) as probe:
            try:
                probe.bind((place[0], 0, *place[2:]))
            except OSError:
                return False
    return True
