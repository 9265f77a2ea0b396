/* SPDX-License-Identifier: MIT */
/* TCP sockets whose cable is pulled: nothing comes in, and nothing goes out.
 *
 * In: sockets that listen or are connected. From then on the system throws away each segment that comes for them,
 * without a word (RFC 5082: no segment with less than the largest TTL is taken). This needs no privilege. A socket
 * filter would do the same, but on TCP sockets newer kernels ask for a privilege. Two things still go out.
 * The system repeats bytes that the peer had not confirmed, which is why sockets_silence waits for the confirmation.
 * And a peer that sends with a TTL of 255 is heard, and answered. The caller writes nothing meanwhile. */
#ifndef DRIVERS_SOCKET_SILENCE_H
#define DRIVERS_SOCKET_SILENCE_H

/* Silences a listener, and then n connections; descriptors below 0 are left out. Between the two it waits for up to
 * 200 ms until the peers have confirmed what was sent to them. Keep-alive probes stop, so that a connection lasts.
 * Returns 0, or SH_ESTATE: the system can't do it, and all sockets take bytes as before. */
int sockets_silence(int listener, const int *fds, int n);
/* Ends the silence: the connections go on. */
void sockets_speak(int listener, const int *fds, int n);

#endif
