/* SPDX-License-Identifier: MIT */
/* `TIME:SHIFt` and `TIME:SERVer`: the clock of a scanner that keeps a date of its own, and the time server that sets
 * it.
 *
 *   TIME:SHIFt ns                             sets how far the clock is ahead of one that was not set since
 *                                             power-up
 *   TIME:SERVer role,address,update,zone,interface
 *                                             NONE, CLIENT or SERVER; a numeric IPv4 address; s; h; ETH or CAN
 *   TIME:SERVer?                              the same
 *   TIME:SERVer? STATe                        state, limit, offset and delay (ns), and how many answers were good,
 *                                             refused, missing */
#ifndef FIRMWARE_SIM_COMMAND_TIME_SERVER_H
#define FIRMWARE_SIM_COMMAND_TIME_SERVER_H

struct command_call;

int command_shift_query(struct command_call *call);
int command_shift_change(struct command_call *call);
int command_server_query(struct command_call *call);
int command_server_change(struct command_call *call);
struct command_device;
struct command_time_server;
/* Gives a scanner another time server. dev->server.n_roles is not taken from `server`: it counts the role's changes. */
void command_server_set(struct command_device *dev, const struct command_time_server *server);

#endif
