/* SPDX-License-Identifier: MIT */
/* The client's process. In: a command for sh -c. Out: whether it runs, and how it ended. The client is the shell and
 * all that descends from it. If this program is killed, only the shell ends with it: what the shell has started may go
 * on. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_CLIENT_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_CLIENT_H

#include <stdint.h>
#include <sys/types.h>

#include "core/err.h"

struct client_words {
    const char *endpoint; /* tcp:127.0.0.1:40123 or tty:/dev/pts/3 */
    const char *out;      /* a file for points */
};

/* Puts the values in place of {endpoint}, {host}, {port}, {path} and {out}; other braces stay. The result is
 * to be freed; NULL: no memory. */
char *client_fill(const char *text, const struct client_words *words);

struct client {
    int in_fd; /* its standard input, which stays open and empty: some clients end when it closes, or at a key */
    pid_t pid; /* of the shell, and of the group; 0: none was started */
    int64_t started_ns, ended_ns; /* ended_ns 0: some process of the client is there */
    int status;                   /* the shell's, as waitpid has it */
    int had_to_be_killed;
    int has_others; /* this process had children before: only the client's group is waited for and ended then */
};

/* out: the file for standard output; NULL: it goes into the log, as standard error does. Both files are emptied. */
int client_start(struct client *client, const char *line, const char *log, const char *out, struct sh_err *err);
/* Returns 1 when the shell and all processes that descend from it have ended. */
int client_has_ended(struct client *client);
/* Sends SIGTERM, and SIGKILL after grace_s. client_end must be called once after each client_start. */
void client_end(struct client *client, double grace_s);

#endif
