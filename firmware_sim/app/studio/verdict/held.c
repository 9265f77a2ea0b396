/* SPDX-License-Identifier: MIT */
/* A connection that the client still has is in the system's table of TCP, unless the head's end was abrupt: then its socket
 * is in no table any more, and only the client's open descriptors show it. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/studio/verdict/held.h"

/* States of /proc/net/tcp (tcp_states.h of Linux): the client's end is open, or it has only not closed yet. */
enum { STATE_ESTABLISHED = 1, STATE_CLOSE_WAIT = 8, PATH_BYTES = 320 };

/* Calls see for each line of a file until it returns 1; then that, else 0. */
static int any_line(const char *path, int (*see)(const char *line, unsigned long what), unsigned long what)
{
    FILE *file = fopen(path, "r");
    char line[512];
    int seen = 0;
    while (file != NULL && !seen && fgets(line, sizeof line, file) != NULL)
        seen = see(line, what);
    if (file != NULL) fclose(file);
    return seen;
}

static int is_held(const char *line, unsigned long port)
{
    unsigned local, state;
    return sscanf(line, " %*u: %*8x:%4x %*8x:%*4x %2x", &local, &state) == 2 && local == port &&
           (state == STATE_ESTABLISHED || state == STATE_CLOSE_WAIT);
}

static int has_inode(const char *line, unsigned long inode)
{
    char word[32];
    snprintf(word, sizeof word, " %lu ", inode);
    return strstr(line, word) != NULL;
}

/* Whether a socket is in no table: it was connected, and is so no more. */
static int is_dead(unsigned long inode)
{
    static const char *const tables[] = {"tcp", "tcp6", "udp", "udp6", "unix", "netlink", "raw", "packet"};
    for (size_t i = 0; i < sizeof tables / sizeof tables[0]; i++) {
        char path[PATH_BYTES];
        snprintf(path, sizeof path, "/proc/net/%s", tables[i]);
        if (any_line(path, has_inode, inode)) return 0;
    }
    return 1;
}

static int has_dead(const char *process)
{
    char path[PATH_BYTES], link[PATH_BYTES];
    snprintf(path, sizeof path, "/proc/%.20s/fd", process);
    DIR *folder = opendir(path);
    int dead = 0;
    for (struct dirent *entry; folder != NULL && !dead && (entry = readdir(folder)) != NULL;) {
        unsigned long inode;
        snprintf(path, sizeof path, "/proc/%.20s/fd/%.20s", process, entry->d_name);
        const ssize_t len = readlink(path, link, sizeof link - 1);
        if (len < 0) continue;
        link[len] = '\0';
        dead = sscanf(link, "socket:[%lu]", &inode) == 1 && is_dead(inode);
    }
    if (folder != NULL) closedir(folder);
    return dead;
}

/* /proc/N/stat: the group is the third field after the name in brackets. */
static int is_of_group(const char *line, unsigned long group)
{
    const char *name_end = strrchr(line, ')');
    long of;
    return name_end != NULL && sscanf(name_end, ") %*c %*d %ld", &of) == 1 && of == (long)group;
}

static int has_dead_in_group(pid_t group)
{
    DIR *processes = opendir("/proc");
    int dead = 0;
    for (struct dirent *entry; processes != NULL && !dead && (entry = readdir(processes)) != NULL;) {
        char path[PATH_BYTES];
        if (entry->d_name[0] < '1' || entry->d_name[0] > '9') continue;
        snprintf(path, sizeof path, "/proc/%.20s/stat", entry->d_name);
        dead = any_line(path, is_of_group, (unsigned long)group) && has_dead(entry->d_name);
    }
    if (processes != NULL) closedir(processes);
    return dead;
}

int held_any(struct watch *watch, pid_t group)
{
    int missing = 0, held = 0;
    pthread_mutex_lock(&watch->lock);
    for (size_t i = 0; i < watch->n_broken && !held; i++) {
        const char *port = strrchr(watch->broken[i].peer, ':');
        if (watch->broken[i].back_ns != 0 || port == NULL) continue;
        missing = 1;
        held = any_line("/proc/net/tcp", is_held, strtoul(port + 1, NULL, 10));
    }
    pthread_mutex_unlock(&watch->lock);
    return held || (missing && has_dead_in_group(group));
}
