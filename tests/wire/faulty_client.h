/* SPDX-License-Identifier: MIT */
/* A client in plain sockets, which starts a scan, writes its points as text, and comes back after each end of its
 * connection. The client can have faults. As a program of its own: PROGRAM client HOST PORT FILE FAULTS. */
#ifndef TESTS_WIRE_FAULTY_CLIENT_H
#define TESTS_WIRE_FAULTY_CLIENT_H

/* FAULTS has these letters, or is `none`: c takes frames with a wrong checksum; s stays away once its connection has
 * ended; t takes a repeated frame again; h holds on to a connection that has ended; a asks for an unknown command;
 * d dies once it has points; k goes on after SIGTERM; n never asks for a scan. Returns the exit status; SIGTERM
 * ends it. */
int faulty_client(int argc, char **argv);

#endif
