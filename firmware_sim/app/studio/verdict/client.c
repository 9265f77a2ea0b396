/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "firmware_sim/app/studio/verdict/client.h"
#include "firmware_sim/base/clock.h"

enum { LOOK_MS = 5, PART_LEN = 512 };

/* ---- placeholders */

struct client_part {
    const char *name;
    char value[PART_LEN];
};

/* "tcp:HOST:PORT", where HOST may be "[::1]"; "tty:PATH". */
static void split_endpoint(const char *endpoint, char host[PART_LEN], char port[PART_LEN], char path[PART_LEN])
{
    const char *at = strchr(endpoint, ':'), *last = strrchr(endpoint, ':');
    host[0] = port[0] = path[0] = '\0';
    if (at == NULL) return;
    if (strncmp(endpoint, "tty:", 4) == 0) {
        snprintf(path, PART_LEN, "%s", at + 1);
        return;
    }
    const int is_bracketed = at[1] == '[';
    snprintf(host, PART_LEN, "%.*s", (int)(last - at - 1 - 2 * is_bracketed), at + 1 + is_bracketed);
    snprintf(port, PART_LEN, "%s", last + 1);
}

static const struct client_part *find_part(const struct client_part *parts, size_t n, const char *at)
{
    for (size_t i = 0; i < n; i++)
        if (strncmp(at, parts[i].name, strlen(parts[i].name)) == 0) return &parts[i];
    return NULL;
}

char *client_fill(const char *text, const struct client_words *words)
{
    struct client_part parts[] = {{"{endpoint}", ""}, {"{out}", ""}, {"{host}", ""}, {"{port}", ""}, {"{path}", ""}};
    char *filled = NULL;
    size_t len;
    snprintf(parts[0].value, PART_LEN, "%s", words->endpoint);
    snprintf(parts[1].value, PART_LEN, "%s", words->out);
    split_endpoint(words->endpoint, parts[2].value, parts[3].value, parts[4].value);
    FILE *out = open_memstream(&filled, &len);
    if (out == NULL) return NULL;
    while (*text != '\0') {
        const struct client_part *part = find_part(parts, sizeof parts / sizeof parts[0], text);
        if (part != NULL)
            fputs(part->value, out);
        else
            fputc(*text, out);
        text += part != NULL ? strlen(part->name) : 1;
    }
    if (fclose(out) == 0) return filled;
    free(filled);
    return NULL;
}

/* ---- the process */

static int set_up(posix_spawnattr_t *attr, posix_spawn_file_actions_t *files, int in_fd, const char *log,
                  const char *out)
{
    sigset_t all, none;
    sigfillset(&all);
    sigemptyset(&none);
    int rc = posix_spawnattr_setflags(attr, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
    rc |= posix_spawnattr_setpgroup(attr, 0) | posix_spawnattr_setsigdefault(attr, &all);
    rc |= posix_spawnattr_setsigmask(attr, &none);
    rc |= posix_spawn_file_actions_adddup2(files, in_fd, 0);
    rc |= posix_spawn_file_actions_addopen(files, 2, log, O_WRONLY | O_APPEND, 0);
    rc |= out == NULL ? posix_spawn_file_actions_adddup2(files, 2, 1)
                      : posix_spawn_file_actions_addopen(files, 1, out, O_WRONLY, 0);
    rc |= posix_spawn_file_actions_addclosefrom_np(files, 3);
    return rc;
}

static int make_empty(const char *path, struct sh_err *err)
{
    const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd < 0) return sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    close(fd);
    return SH_OK;
}

int client_start(struct client *client, const char *line, const char *log, const char *out, struct sh_err *err)
{
    posix_spawnattr_t attr;
    posix_spawn_file_actions_t files;
    char *const argv[] = {(char *)"sh", (char *)"-c", (char *)line, NULL};
    int in[2];
    *client = (struct client){.in_fd = -1};
    int rc = make_empty(log, err);
    if (rc == SH_OK && out != NULL) rc = make_empty(out, err);
    if (rc == SH_OK && pipe2(in, O_CLOEXEC) != 0) rc = sh_fail(err, SH_EIO, "pipe: %s", strerror(errno));
    if (rc != SH_OK) return rc;
    client->in_fd = in[1];
    /* What the shell leaves behind becomes a child of this process, which can then wait for it. */
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0);
    posix_spawnattr_init(&attr);
    posix_spawn_file_actions_init(&files);
    rc = set_up(&attr, &files, in[0], log, out);
    client->started_ns = clock_now_ns();
    if (rc == 0) rc = posix_spawn(&client->pid, "/bin/sh", &files, &attr, argv, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attr);
    close(in[0]);
    if (rc == 0) return SH_OK;
    client->pid = 0;
    return sh_fail(err, SH_EIO, "--client: sh can't be started: %s", strerror(rc));
}

int client_has_ended(struct client *client)
{
    int status;
    pid_t pid;
    if (client->pid == 0 || client->ended_ns != 0) return 1;
    while ((pid = waitpid(-client->pid, &status, WNOHANG)) > 0)
        if (pid == client->pid) client->status = status;
    if (pid == 0) return 0;
    client->ended_ns = clock_now_ns();
    prctl(PR_SET_CHILD_SUBREAPER, 0, 0, 0, 0);
    return 1;
}

static int wait_for_end(struct client *client, double s)
{
    const int64_t until_ns = clock_now_ns() + (int64_t)(1e9 * s);
    while (!client_has_ended(client) && clock_now_ns() < until_ns)
        poll(NULL, 0, LOOK_MS);
    return client_has_ended(client);
}

void client_end(struct client *client, double grace_s)
{
    static const double KILLED_WITHIN_S = 5.0; /* a process that the kernel holds is not waited for */
    if (client->pid != 0 && !client_has_ended(client)) {
        kill(-client->pid, SIGTERM);
        client->had_to_be_killed = !wait_for_end(client, grace_s);
        if (client->had_to_be_killed) kill(-client->pid, SIGKILL);
        wait_for_end(client, KILLED_WITHIN_S);
    }
    if (client->in_fd >= 0) close(client->in_fd);
    client->in_fd = -1;
}
