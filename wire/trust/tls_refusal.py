"""Why a TLS handshake with an endpoint fails: Zenoh tries again and again and says nothing, so it is done once here.

In TLS 1.3 the end that connects verifies first. Whether the other end takes its certificate comes as an alert with the
first bytes that it reads.
"""

from __future__ import annotations

import socket
import ssl

from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.wording import printable

_VERIFY_NOT_YET, _VERIFY_EXPIRED = 9, 10
"""OpenSSL's codes X509_V_ERR_CERT_NOT_YET_VALID and X509_V_ERR_CERT_HAS_EXPIRED."""

_ASKING = ("CERTIFICATE_REQUIRED", "HANDSHAKE_FAILURE")
"""How OpenSSL's names end of the alerts of an end that was shown no certificate: of TLS 1.3, and of TLS 1.2."""

_FOREIGN = ("UNKNOWN_CA", "DECRYPT_ERROR", "BAD_CERTIFICATE")
"""How OpenSSL's names end of the alerts of an end that has the certificate of another authority: that may have the same
name and another key."""


def tls_refusal(host: str, port: int, credentials: Credentials | None, timeout: float) -> str:
    """Return why the other end and this one do not agree on a link; empty if they do, or if it is not known.

    It is the end of a sentence that begins with the other end. Without credentials the links of this end are open. A
    connection, the handshake on it, and the alert after that are waited for as long as `timeout` each (s).
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # a member is known by its name alone
    try:
        if credentials is not None:
            context.load_cert_chain(credentials.certificate, credentials.key)
            context.load_verify_locations(credentials.ca)
            context.verify_mode = ssl.CERT_REQUIRED
        with socket.create_connection((host, port), timeout) as raw:
            return _handshake_refusal(context, raw, credentials)
    except OSError:  # nobody is there, or files of ours have gone; ssl.SSLError is one, too
        return ""


def _handshake_refusal(context: ssl.SSLContext, raw: socket.socket, credentials: Credentials | None) -> str:
    """Return the refusal of a handshake on a connection."""
    try:
        secured = context.wrap_socket(raw)
    except ssl.SSLCertVerificationError as error:
        assert credentials is not None
        return _unverified(error, credentials)
    except OSError as error:  # also if it closes, as a plant without certificates does, or one that is too busy
        return _alert(error, credentials)
    with secured:
        try:
            secured.recv(1)  # the alert comes with the first read; an end that talks on would hold a second one
        except OSError as error:
            return _alert(error, credentials)
    return ""


def _unverified(error: ssl.SSLCertVerificationError, credentials: Credentials) -> str:
    """Return why this end does not accept the other's certificate."""
    if error.verify_code == _VERIFY_EXPIRED:
        return (  # OpenSSL has one code for both certificates; no member's outlives its authority's
            "shows a certificate that has expired; gridpeers keys issue renews it where the site was made, unless "
            f"{credentials.ca} has expired too: then gridpeers keys init makes a new site"
        )
    if error.verify_code == _VERIFY_NOT_YET:
        return "shows a certificate that is not valid yet by the clock of this host; set the clock"
    return f"shows a certificate that {credentials.ca} has not signed: it is of another site"


def _alert(error: OSError, credentials: Credentials | None) -> str:
    """Return why the other end does not accept this one; empty if the error tells nothing of certificates."""
    reason = (error.reason or "") if isinstance(error, ssl.SSLError) else ""
    if "ALERT" not in reason:
        return ""
    if credentials is None:
        return "asks for a certificate" if reason.endswith(_ASKING) else ""
    if reason.endswith("CERTIFICATE_REQUIRED"):
        return "asks for a certificate"
    own = f"does not accept the certificate of {credentials.own.name}"
    if reason.endswith(_FOREIGN):
        return f"{own}: by the ca.pem there it is of another site"
    if reason.endswith("CERTIFICATE_EXPIRED"):
        return f"{own}: it has expired by the clock there"
    return f"{own} (TLS alert {printable(reason, 60)})"
