"""How other machines name this one."""

import ipaddress
import socket

import ifaddr


def addresses() -> list[str]:
    """IP addresses of this machine, the one by which it reaches others first, loopback last; IPv6 without scopes."""
    found = [ip.ip if isinstance(ip.ip, str) else ip.ip[0] for a in ifaddr.get_adapters() for ip in a.ips]
    usable = [ip for ip in map(ipaddress.ip_address, found) if not (ip.version == 6 and ip.is_link_local)]
    first = main_address()
    return [str(ip) for ip in sorted(usable, key=lambda ip: (str(ip) != first, ip.is_loopback, ip.version, int(ip)))]


def host_names() -> list[str]:
    """Names of this machine, `localhost` last."""
    short = socket.gethostname().partition(".")[0].lower()
    names = dict.fromkeys([socket.gethostname().lower(), f"{short}.local", short, "localhost"])
    return [name for name in names if name.isascii() and name.replace("-", "").replace(".", "").isalnum()]


def main_address() -> str:
    """This machine's address on the network that it reaches others by; loopback when there is none. Sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # an address for documentation: only the way to it is looked up
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"
