/* SPDX-License-Identifier: MIT */
#include "tests/bench/clients.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static int open_tcp(const char *endpoint)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    at.sin_port = htons((uint16_t)atoi(strrchr(endpoint, ':') + 1));
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, (struct sockaddr *)&at, sizeof at) == 0) return fd;
    if (fd >= 0) close(fd);
    return -1;
}

static void read_all(int fd)
{
    static char bytes[1 << 18];
    while (fd >= 0 && read(fd, bytes, sizeof bytes) > 0)
        continue;
}

static void begin_client(struct bench_clients *clients, const char *endpoint)
{
    const int is_tcp = strncmp(endpoint, "tcp:", 4) == 0, is_tty = strncmp(endpoint, "tty:", 4) == 0;
    if ((!is_tcp && !is_tty) || clients->n == BENCH_MAX_CLIENTS) return;
    const pid_t pid = fork();
    if (pid > 0) clients->pid[clients->n++] = pid;
    if (pid != 0) return;
    read_all(is_tcp ? open_tcp(endpoint) : open(endpoint + 4, O_RDONLY | O_NOCTTY | O_CLOEXEC));
    _exit(0);
}

void bench_clients_begin(struct bench_clients *clients, int ready_fd, int reads)
{
    static const char KEY[] = "\"endpoint\":\"";
    char text[8192];
    size_t len = 0;
    ssize_t n;
    while ((n = read(ready_fd, text + len, sizeof text - 1 - len)) > 0)
        len += (size_t)n;
    close(ready_fd);
    text[len] = '\0';
    for (char *at = text, *end; reads && (at = strstr(at, KEY)) != NULL; at = end + 1) {
        at += sizeof KEY - 1;
        end = strchr(at, '"');
        if (end == NULL) return;
        *end = '\0';
        begin_client(clients, at);
    }
}

void bench_clients_end(const struct bench_clients *clients)
{
    for (int i = 0; i < clients->n; i++)
        waitpid(clients->pid[i], NULL, 0);
}
