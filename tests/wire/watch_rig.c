/* SPDX-License-Identifier: MIT */
#include "tests/wire/watch_rig.h"

#include <poll.h>

/* A floor of 8 x 8 m and two walls, 3 m high: half of all shots go into the open. */
static const char SCENE[] = "v -4 -4 0\nv 4 -4 0\nv 4 4 0\nv -4 4 0\nv 4 -4 3\nv 4 4 3\nv -4 4 3\n"
                            "o floor\nf 1 2 3 4\no east\nf 2 5 6 3\no north\nf 3 6 7 4\n";

static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
    "scene:\n  meshes: [{file: corner.obj, up: z, scale: 1}]\n"
    "  anchor: {source: explicit, origin_m: [0, 0, 0], lat_deg: 52, lon_deg: 13, height_m: 100}\n"
    "stations:\n  - {name: first, position_m: [0.31, -0.42, 1.7], heading_deg: 30}\n"
    "  - {name: second, position_m: [-2.2, 1.3, 1.5], heading_deg: 200}\n"
    "beam: {mode: single}\n"
    "coverage: {cell_m: 0.25}\n"
    "fields: [{number: 3, name: gate, shape: rectangle, corner_m: [-1, 0.5], size_m: [2, 1]}]\n"
    "output: {layout: geo, crs: utm}\n"
    "loop: {pace: fast}\n"
    "links: [{type: tcp}, {type: web, waits: 'yes'}]\n";

void watch_prepare(struct wire *wire, char config[256])
{
    wire_write_text(wire, "corner.obj", SCENE);
    snprintf(config, 256, "%s", wire_write_text(wire, "config.yaml", CONFIG));
}

/* ---- answers */

/* Returns the body; free it. */
char *watch_ask(const struct head *head, const char *path, size_t *len)
{
    char request[256], *answer = NULL;
    size_t n = 0, room = 0;
    ssize_t got;
    const int fd = raw_connect(head_endpoint(head, "web"));
    const int port = endpoint_port(head_endpoint(head, "web"));
    snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: close\r\n\r\n", path, port);
    raw_send(fd, request, strlen(request));
    do {
        if (n + 65536 > room) answer = realloc(answer, room = 2 * room + 65536 + 1);
        assert_non_null(answer);
        got = read(fd, answer + n, room - n - 1);
        assert_true(got >= 0);
        n += (size_t)got;
        answer[n] = '\0';
    } while (got > 0);
    close(fd);
    *len = n;
    return answer;
}

char *watch_get(const struct head *head, const char *path, size_t *len)
{
    size_t n;
    char *answer = watch_ask(head, path, &n);
    char *body = strstr(answer, "\r\n\r\n");
    if (strncmp(answer, "HTTP/1.1 200", 12) != 0 || body == NULL) fail_msg("%s: %.60s", path, answer);
    body += 4;
    *len = n - (size_t)(body - answer);
    memmove(answer, body, *len + 1);
    return answer;
}

/* Returns the quality once a scan is over. The head computes it twice a second at most, so asking faster would only
 * cost. */
char *watch_quality(const struct head *head, unsigned station, unsigned scan)
{
    char begin[64];
    size_t len;
    snprintf(begin, sizeof begin, "{\"scan\":%u,\"station\":%u,\"over\":true,", scan, station);
    for (const int64_t until = wire_now_ms() + DEADLINE_MS; wire_now_ms() < until;) {
        char *json = watch_get(head, "/quality", &len);
        if (strncmp(json, begin, strlen(begin)) == 0) return json;
        free(json);
        poll(NULL, 0, 50);
    }
    fail_msg("scan %u does not end", scan);
    return NULL;
}

char *watch_scan(const struct head *head, struct scanhead *sh, unsigned station, unsigned scan)
{
    char line[32];
    struct scanhead_frame frame;
    snprintf(line, sizeof line, "HEAD:STATION %u", station);
    client_wait_state(sh, "idle");
    client_tell(sh, line);
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    return watch_quality(head, station, scan);
}

char *watch_command(struct wire *wire, const char *const *first, const char *set)
{
    const char *args[WIRE_MAX_ARGS];
    size_t n = 0;
    while (*first != NULL)
        args[n++] = *first++;
    if (set != NULL) {
        args[n++] = "--set";
        args[n++] = set;
    }
    args[n] = NULL;
    wire_run(wire, args, 0);
    return wire_read(wire_path(wire, "out"), NULL);
}
