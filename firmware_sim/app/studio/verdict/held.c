/* SPDX-License-Identifier: MIT */
/* A connection that the client still has is in the system's table of TCP, unless the head's end was abrupt: then its
 * socket is in no table any more, and only the client's open descriptors show it. */
#include <arpa/inet.h>
#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/studio/verdict/family.h"
#include "firmware_sim/app/studio/verdict/held.h"

/* States of /proc/net/tcp (tcp_states.h of Linux) in which the client's end is open. ESTABLISHED: the head's end is
 * open, too. CLOSE_WAIT: the head's end has closed. */
enum { STATE_ESTABLISHED = 1, STATE_CLOSE_WAIT = 8, PATH_BYTES = 320, MAX_ADDRESSES = 256 };

/* Calls `see` for each line of a file until a call returns 1. Returns 1 then, else 0. */
static int any_line(const char *path, int (*see)(const char *line, uint64_t what), uint64_t what)
{
    FILE *file = fopen(path, "r");
    char line[512];
    int seen = 0;
    while (file != NULL && !seen && fgets(line, sizeof line, file) != NULL)
        seen = see(line, what);
    if (file != NULL) fclose(file);
    return seen;
}

/* The table prints the host's four bytes as one number in the byte order of this machine. */
static uint64_t address_of(uint32_t host, unsigned port)
{
    return (uint64_t)host << 16 | port;
}

static int is_held(const char *line, uint64_t address)
{
    unsigned host, port, state;
    return sscanf(line, " %*u: %8x:%4x %*8x:%*4x %2x", &host, &port, &state) == 3 &&
           address_of(host, port) == address && (state == STATE_ESTABLISHED || state == STATE_CLOSE_WAIT);
}

/* In some tables the inode is at the end of a line. */
static int has_inode(const char *line, uint64_t inode)
{
    char word[32];
    const int len = snprintf(word, sizeof word, " %" PRIu64, inode);
    const char *at = line;
    while ((at = strstr(at, word)) != NULL && at[len] != ' ' && at[len] != '\n')
        at += len;
    return at != NULL;
}

/* Whether a socket is in no table: it was connected, and no longer is. */
static int is_dead(uint64_t inode)
{
    static const char *const tables[] = {"tcp",  "tcp6",  "udp",     "udp6", "raw",   "raw6",
                                         "icmp", "icmp6", "netlink", "unix", "packet"};
    for (size_t i = 0; i < sizeof tables / sizeof tables[0]; i++) {
        char path[PATH_BYTES];
        snprintf(path, sizeof path, "/proc/net/%s", tables[i]);
        if (any_line(path, has_inode, inode)) return 0;
    }
    return 1;
}

static int has_dead(void *ctx, pid_t pid)
{
    char path[PATH_BYTES], link[PATH_BYTES];
    (void)ctx;
    snprintf(path, sizeof path, "/proc/%d/fd", (int)pid);
    DIR *folder = opendir(path);
    int dead = 0;
    for (struct dirent *entry; folder != NULL && !dead && (entry = readdir(folder)) != NULL;) {
        uint64_t inode;
        snprintf(path, sizeof path, "/proc/%d/fd/%.20s", (int)pid, entry->d_name);
        const ssize_t len = readlink(path, link, sizeof link - 1);
        if (len < 0) continue;
        link[len] = '\0';
        dead = sscanf(link, "socket:[%" SCNu64 "]", &inode) == 1 && is_dead(inode);
    }
    if (folder != NULL) closedir(folder);
    return dead;
}

/* Copies the clients' addresses of sessions after which nobody came back. The links' threads need the lock, so it is
 * not held while files are read. */
static size_t copy_addresses(struct watch *watch, uint64_t *address, size_t cap)
{
    size_t n = 0;
    pthread_mutex_lock(&watch->lock);
    for (size_t i = 0; i < watch->n_broken && n < cap; i++) {
        const char *peer = watch->broken[i].peer, *port = strrchr(peer, ':');
        char text[INET_ADDRSTRLEN];
        struct in_addr host;
        if (watch->broken[i].back_ns != 0 || port == NULL) continue;
        snprintf(text, sizeof text, "%.*s", (int)(port - peer), peer);
        if (inet_pton(AF_INET, text, &host) != 1) continue;
        address[n++] = address_of(host.s_addr, (unsigned)strtoul(port + 1, NULL, 10));
    }
    pthread_mutex_unlock(&watch->lock);
    return n;
}

int held_any(struct watch *watch)
{
    uint64_t address[MAX_ADDRESSES];
    const size_t n = copy_addresses(watch, address, MAX_ADDRESSES);
    int held = 0;
    for (size_t i = 0; i < n && !held; i++)
        held = any_line("/proc/net/tcp", is_held, address[i]);
    return held || (n > 0 && family_any(has_dead, NULL));
}
