/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/newfile.h"
#include "firmware_sim/app/studio/verdict/client.h"
#include "firmware_sim/app/studio/verdict/family.h"
#include "firmware_sim/base/clock.h"

enum { LOOK_MS = 5, PART_LEN = 512 };

/* ---- placeholders */

struct client_part {
    const char *name;
    char value[PART_LEN];
};

/* "tcp:HOST:PORT", where HOST may be "[::1]"; "tty:PATH". The parts are empty before, and those that an endpoint lacks
 * stay so. */
static void split_endpoint(const char *endpoint, char host[PART_LEN], char port[PART_LEN], char path[PART_LEN])
{
    const char *at = strchr(endpoint, ':'), *last = strrchr(endpoint, ':');
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

/* Runs in the new process, which has only the thread that forked. Sets signals and descriptors as a new program expects
 * them. The kernel kills the process when this program ends. */
static void become_client(int in_fd, int log_fd, int out_fd, const char *line)
{
    sigset_t none;
    sigemptyset(&none);
    for (int number = 1; number < NSIG; number++)
        signal(number, SIG_DFL);
    sigprocmask(SIG_SETMASK, &none, NULL);
    if (setpgid(0, 0) != 0 || dup2(in_fd, 0) < 0 || dup2(out_fd, 1) < 0 || dup2(log_fd, 2) < 0 ||
        close_range(3, ~0U, 0) != 0 || prctl(PR_SET_PDEATHSIG, SIGKILL) != 0)
        _exit(127);
    execl("/bin/sh", "sh", "-c", line, (char *)NULL);
    _exit(127);
}

static int client_fork(struct client *client, int log_fd, int out_fd, const char *line, struct sh_err *err)
{
    int in[2];
    if (pipe2(in, O_CLOEXEC) != 0) return sh_fail(err, SH_EIO, "pipe: %s", strerror(errno));
    client->in_fd = in[1];
    client->started_ns = clock_now_ns();
    siginfo_t child;
    client->has_others = waitid(P_ALL, 0, &child, WEXITED | WNOHANG | WNOWAIT) == 0;
    /* Processes that the shell leaves behind become children of this one, which can then wait for them. */
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0);
    const pid_t pid = fork();
    if (pid == 0) become_client(in[0], log_fd, out_fd, line);
    close(in[0]);
    if (pid < 0) return sh_fail(err, SH_EIO, "--client: no process: %s", strerror(errno));
    setpgid(pid, pid); /* both processes do so: neither waits for the other */
    client->pid = pid;
    return SH_OK;
}

int client_start(struct client *client, const char *line, const char *log, const char *out, struct sh_err *err)
{
    int log_fd = -1, out_fd = -1;
    *client = (struct client){.in_fd = -1};
    int rc = newfile_open(log, &log_fd, err);
    if (rc == SH_OK && out != NULL) rc = newfile_open(out, &out_fd, err);
    if (rc == SH_OK) rc = client_fork(client, log_fd, out != NULL ? out_fd : log_fd, line, err);
    if (log_fd >= 0) close(log_fd);
    if (out_fd >= 0) close(out_fd);
    return rc;
}

int client_has_ended(struct client *client)
{
    int status;
    pid_t pid;
    if (client->pid == 0 || client->ended_ns != 0) return 1;
    while ((pid = waitpid(client->has_others ? -client->pid : -1, &status, WNOHANG)) > 0)
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

struct signal_to {
    int number;
    pid_t group; /* the signal was sent to it as a whole */
};

static int client_signal_one(void *ctx, pid_t pid)
{
    const struct signal_to *to = ctx;
    if (getpgid(pid) != to->group) kill(pid, to->number);
    return 0;
}

static void client_signal(const struct client *client, int number)
{
    struct signal_to to = {number, client->pid};
    kill(-client->pid, number);
    if (!client->has_others) family_any(client_signal_one, &to);
}

/* A process that is killed may have started another one just before, so the signal is sent again. */
static void client_kill(struct client *client)
{
    static const double KILLED_WITHIN_S = 5.0, AGAIN_S = 0.1; /* a process that the kernel holds is not waited for */
    const int64_t until_ns = clock_now_ns() + (int64_t)(1e9 * KILLED_WITHIN_S);
    do
        client_signal(client, SIGKILL);
    while (!wait_for_end(client, AGAIN_S) && clock_now_ns() < until_ns);
}

void client_end(struct client *client, double grace_s)
{
    if (client->pid != 0 && !client_has_ended(client)) {
        client_signal(client, SIGTERM);
        client->had_to_be_killed = !wait_for_end(client, grace_s);
        if (client->had_to_be_killed) client_kill(client);
    }
    if (client->in_fd >= 0) close(client->in_fd);
    client->in_fd = -1;
}
