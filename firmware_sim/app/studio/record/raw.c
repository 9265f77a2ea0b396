/* SPDX-License-Identifier: MIT */
/* The command line of `record --raw`. */
#include "firmware_sim/app/studio/record/raw.h"

#include <stdlib.h>
#include <string.h>

#include "core/text.h"

int raw_is_wanted(int argc, char **argv)
{
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++)
        if (strcmp(argv[i], "--raw") == 0) return 1;
    return 0;
}

/* ---- escapes */

/* Reads an escape after its backslash. Returns how many characters it has; 0: it is no escape. */
static size_t read_escape(const char *at, uint8_t *byte)
{
    static const char names[] = "nrt\\\"'0", bytes[] = "\n\r\t\\\"'";
    const char *name = *at != '\0' ? strchr(names, *at) : NULL;
    if (*at == 'x') {
        const int high = text_hex_digit(at[1]), low = high >= 0 ? text_hex_digit(at[2]) : -1;
        *byte = (uint8_t)(16 * high + low);
        return low >= 0 ? 3 : 0;
    }
    if (name == NULL) return 0;
    *byte = (uint8_t)bytes[name - names];
    return 1;
}

const char *raw_unescape(const char *text, uint8_t *out, size_t *len)
{
    *len = 0;
    while (*text != '\0') {
        uint8_t *byte = &out[(*len)++];
        *byte = (uint8_t)*text;
        if (*text++ != '\\') continue;
        const size_t n = read_escape(text, byte);
        if (n == 0) return "allowed after a backslash: n, r, t, 0, \\, \", ', or x and two hexadecimal digits";
        text += n;
    }
    return *len > 0 ? NULL : "it is empty";
}

/* ---- options */

static const struct app_command command;

static int take_file(void *values, const char *text)
{
    struct raw *r = values;
    if (r->path != NULL) return app_usage(&command, "-o %s: --raw writes one file, and there is %s", text, r->path);
    if (!app_ends_in(text, ".pcapng")) return app_usage(&command, "-o %s: with --raw allowed is NAME.pcapng", text);
    r->path = text;
    return APP_OK;
}

static int take_send(void *values, const char *text)
{
    struct raw *r = values;
    const size_t room = strlen(text) + 1;
    if (r->n_sends == RAW_MAX_SENDS) return app_usage(&command, "--send: at most %d are allowed", RAW_MAX_SENDS);
    if (room > 60000) return app_usage(&command, "--send: at most 60000 characters each are allowed");
    struct raw_send *send = &r->send[r->n_sends];
    if ((send->bytes = malloc(room)) == NULL) return app_usage(&command, "--send: no memory");
    const char *wrong = raw_unescape(text, send->bytes, &send->len);
    r->n_sends++;
    return wrong == NULL ? APP_OK : app_usage(&command, "--send %s: %s", text, wrong);
}

static int read_port(const char *text, const char **end)
{
    char *after;
    const long port = *text >= '0' && *text <= '9' ? strtol(text, &after, 10) : -1;
    if (port < 0 || port > 65535) return -1;
    *end = after;
    return (int)port;
}

/* Reads "[HOST:]PORT[,PORT...]", where HOST may be "[::1]". Returns 0 where the text is nothing like it. */
static int read_place(const char *text, int max_ports, struct raw_place *place)
{
    const char *colon = strrchr(text, ':');
    const int len = colon != NULL ? (int)(colon - text) : 0, bracket = len > 0 && text[0] == '[' && colon[-1] == ']';
    const int n = snprintf(place->host, sizeof place->host, "%.*s", len - 2 * bracket, text + bracket);
    if (n < 0 || n >= (int)sizeof place->host) return 0;
    for (const char *at = colon != NULL ? colon + 1 : text;; at++) {
        const int port = place->n_ports < max_ports ? read_port(at, &at) : -1;
        if (port < 0) return 0;
        place->port[place->n_ports++] = port;
        if (*at == '\0') return 1;
        if (*at != ',') return 0;
    }
}

/* A port that is given twice; 0: none. Port 0 may be given twice, since it stands for any free port. */
static int port_twice(const struct raw_place *place)
{
    for (int i = 0; i < place->n_ports; i++)
        for (int k = 0; k < i; k++)
            if (place->port[i] == place->port[k] && place->port[i] != 0) return place->port[i];
    return 0;
}

static int read_source(struct raw *r)
{
    const char *source = r->in.operand[0];
    const int udp = strncmp(source, "udp:", 4) == 0, tcp = strncmp(source, "tcp:", 4) == 0;
    r->ops = udp ? &raw_udp : &raw_tcp;
    if ((!udp && !tcp) || !read_place(source + 4, udp ? RAW_MAX_PORTS : 1, &r->place) || r->place.host[0] == '\0' ||
        (tcp && r->place.port[0] == 0))
        return app_usage(&command, "SOURCE %s: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
                         source);
    if (port_twice(&r->place) != 0)
        return app_usage(&command, "%s: port %d is given twice", source, port_twice(&r->place));
    if (udp && (r->n_sends > 0 || r->relay != NULL))
        return app_usage(&command, "%s: --send and --relay need tcp:HOST:PORT", source);
    if (r->n_sends > 0 && r->relay != NULL)
        return app_usage(&command, "--send and --relay: with --relay only the client sends; allowed is one of them");
    if (r->relay != NULL && !read_place(r->relay, 1, &r->clients))
        return app_usage(&command,
                         "--relay %s: allowed is PORT or ADDRESS:PORT, with a port from 0 (the system's choice) to "
                         "65535",
                         r->relay);
    return APP_GO_ON;
}

int raw_record(int argc, char **argv)
{
    static struct raw raw;
    struct raw *r = &raw;
    struct sh_err err = {0};
    memset(r, 0, sizeof *r);
    int status = app_parse(&command, argc, argv, &r->in, r);
    if (status == APP_GO_ON && r->path == NULL) status = app_usage(&command, "-o FILE.pcapng is needed");
    if (status == APP_GO_ON) status = read_source(r);
    if (status == APP_GO_ON) {
        app_catch_signals();
        const struct app_file part = {.option = "output", .path = r->path, .use = APP_WRITES, .added = ".part"};
        int rc = app_add_file(&r->in, &part) == APP_OK ? app_check_files(&r->in, NULL, &err)
                                                       : sh_fail(&err, SH_EINPUT, "too many files");
        if (rc == SH_OK) rc = raw_run(r, &err);
        status = rc == SH_OK ? APP_OK : app_fail(&err);
    }
    for (int i = 0; i < r->n_sends; i++)
        free(r->send[i].bytes);
    return status;
}

#define AT(member) offsetof(struct raw, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_FLAG, "raw", NULL, .at = AT(raw), .help = "write all data on the wire, of any protocol, to a capture"},
    {APP_CALL, "output", "FILE", .letter = 'o', .apply = take_file, .file = APP_WRITES, .help = "NAME.pcapng"},
    {APP_NUMBER, "duration", "S", .min = 0.001, .max = 1e8, .at = AT(duration_s),
     .help = "end S seconds after the first packet"},
    {APP_NUMBER, "wait", "S", .min = 0.0, .max = 1e8, .at = AT(wait_s),
     .help = "wait up to S seconds for SOURCE to appear, then up to S seconds for its first packet. Without --wait "
             "SOURCE must be there, and its first packet may take as long as --duration"},
    {APP_CALL, "send", "TEXT", .apply = take_send,
     .help = "tcp: send this when connected. \\n, \\r, \\t, \\0, \\\\ and \\xHH are bytes. May be repeated: the next "
             "one goes "
             "when an answer has come and 50 ms were silent, at the latest after 1 s"},
    {APP_TEXT, "relay", "[ADDRESS:]PORT", .at = AT(relay),
     .help = "tcp: listen there (default: 127.0.0.1), and connect each client to SOURCE; both directions are "
             "recorded, until Ctrl-C"},
    {APP_TEXT, "stats", "FILE", .at = AT(stats), .file = APP_FILLS,
     .help = "write the numbers of packets, bytes and dropped packets as JSON; - is standard output"},
    {APP_OUTPUT, "ready-fd", "N", .min = 1, .max = 65535, .at = AT(ready_fd),
     .help = "once it listens, write a line of JSON with the endpoint to descriptor N"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static const char HELP_NOTES[] =
    "SOURCE is one of\n"
    "\n"
    "  udp:ADDRESS:PORT,...     datagrams to an address of this machine, 0.0.0.0 (all of them), a\n"
    "                           broadcast or a group (GROUP%INTERFACE). Port 0: the system\n"
    "                           chooses, and it is printed\n"
    "  tcp:HOST:PORT            a connection to this port; with --relay, one for each client\n"
    "\n"
    "Each packet is an Ethernet frame with the kernel's time. Headers are rebuilt: addresses, ports, lengths,\n"
    "checksums and sequence numbers are right, hardware addresses are invented.\n"
    "\n"
    "Exit status 1: no packet came, the kernel dropped some, the device sent nothing or broke the connection.\n"
    "FILE keeps the packets that came.\n";

static const struct app_command command = {
    .name = "record",
    .operand = {"SOURCE"},
    .needs = "--raw -o FILE.pcapng",
    .summary = "write all data on the wire to a capture",
    .options = OPTIONS,
    .notes = HELP_NOTES,
    .run = raw_record,
};
