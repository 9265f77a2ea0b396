/* SPDX-License-Identifier: MIT */
/* One command line out, one reply line back, while frames go on coming. */
#include <errno.h>
#include <poll.h>
#include <string.h>
#include <strings.h>

#include "drivers/host/exchange.h"

enum { STALE_READS = 32, ANSWERS_MS = 200, ASK_AGAIN_MS = 1000 };

/* Keeps the frames that are in the parser. Returns 1 if the parser is at a line, 0 if it needs more bytes. Negative: an
 * error. */
static int take_items(struct scanhead *sh)
{
    for (;;) {
        enum native_item item = native_parser_next(&sh->parser);
        if (item == NATIVE_TEXT) return 1;
        if (item == NATIVE_MORE) return 0;
        int rc = host_keep(sh);
        if (rc != 0) return rc;
    }
}

/* Returns whether a line is the answer to *IDN?. Its last field names the stream; no other answer ends like this. */
static int is_identity(const char *text)
{
    static const char last[] = "scanhead native ";
    const char *comma = strrchr(text, ',');
    return comma != NULL && strncmp(comma + 1, last, sizeof last - 1) == 0;
}

static int asks_identity(const char *command)
{
    return strncasecmp(command + strspn(command, " :"), "*IDN?", 5) == 0;
}

/* The late answer to a question of exchange_settle() gives no notice. */
void host_stray_line(struct scanhead *sh)
{
    if (sh->source.asked > 0 && is_identity(sh->parser.text)) {
        sh->source.asked--;
        if (sh->notices.identities == 0) return;
        sh->notices.identities--;
    }
    host_note_line(sh, 0);
}

/* Returns 1 if the line at hand is an echo of the command that was just sent. */
static int is_echo(struct scanhead *sh, const char *command)
{
    if (strcmp(sh->parser.text, command) != 0) return 0;
    host_note_line(sh, 1);
    return 1;
}

/* Takes all that is in the parser. */
static int take_all(struct scanhead *sh)
{
    int rc;
    while ((rc = take_items(sh)) == 1)
        host_stray_line(sh);
    return rc;
}

int host_keep_rest(struct scanhead *sh)
{
    native_parser_finish(&sh->parser);
    return take_all(sh);
}

/* Skips lines that came before the command: they answer commands that were given up. Frames may arrive
 * without end, so this looks at a few buffers only. */
static int discard_stale(struct scanhead *sh)
{
    for (int i = 0; i < STALE_READS; i++) {
        int rc = take_all(sh);
        if (rc != 0 || sh->ended) return rc;
        rc = host_fill(sh, 0);
        if (rc == SH_ETIMEOUT) return 0;
        if (rc != 0) return rc;
    }
    return 0;
}

/* Reads on while it waits to write. Otherwise a head that itself waits to write would block both sides. */
static int wait_writable(struct scanhead *sh, int64_t deadline_ns)
{
    short revents;
    int rc = host_wait(sh, POLLIN | POLLOUT, deadline_ns, &revents);
    if (rc != 0 || (revents & POLLIN) == 0) return rc;
    rc = host_fill(sh, deadline_ns);
    if (rc == 0) rc = take_all(sh);
    return rc == 0 && sh->ended ? host_over(sh) : rc;
}

/* The head is gone, but frames that came before can still be read. */
static int gone_while_writing(struct scanhead *sh, int error)
{
    host_note_loss(sh, error);
    return host_gone(sh);
}

static int send_all(struct scanhead *sh, const char *data, size_t len, int64_t deadline_ns)
{
    size_t done = 0;
    while (done < len) {
        ssize_t n = sh->source.ops->write(&sh->source, data + done, len - done);
        int rc = 0;
        if (n > 0)
            done += (size_t)n;
        else if (n < 0 && errno == EAGAIN)
            rc = wait_writable(sh, deadline_ns);
        else if (n < 0 && host_is_hang_up(sh, errno))
            rc = gone_while_writing(sh, errno);
        else if (n < 0 && errno != EINTR)
            rc = sh_fail(&sh->err, SH_EIO, "%s: cannot write: %s", sh->source.name, strerror(errno));
        if (rc != 0) {
            sh->stuck = done > 0;
            return rc;
        }
    }
    return 0;
}

static int check_command(struct scanhead *sh, const char *command, size_t len)
{
    if (sh->source.is_file)
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: a recording takes no commands", sh->source.name);
    if (sh->stuck)
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: an earlier command was sent only in part; open the head again",
                       sh->source.name);
    int blank = 1, printable = 1;
    for (size_t i = 0; i < len; i++) {
        if (command[i] != ' ') blank = 0;
        if (command[i] < 0x20 || command[i] > 0x7e) printable = 0;
    }
    if (blank || !printable || len > NATIVE_MAX_COMMAND)
        return sh_fail(&sh->err, SCANHEAD_EINPUT, "not a command: one line of 1 to %d printable ASCII characters",
                       NATIVE_MAX_COMMAND);
    return 0;
}

static int copy_reply(struct scanhead *sh, char *reply, size_t reply_len)
{
    size_t len = strlen(sh->parser.text);
    if (len >= reply_len)
        return sh_fail(&sh->err, SCANHEAD_EINPUT, "a reply of %zu characters does not fit into %zu", len, reply_len);
    memcpy(reply, sh->parser.text, len + 1);
    sh->err.text[0] = '\0'; /* it may be of a wait on the way */
    return SCANHEAD_OK;
}

static const char identity_query[] = "*IDN?";

/* Skips lines until every question has its answer. An earlier question or its answer may be lost. So once one answer
 * is there, the others have ANSWERS_MS to come. */
static int pass_over(struct scanhead *sh, int64_t deadline_ns)
{
    int answered = 0;
    while (sh->source.asked > 0) {
        int rc = take_items(sh);
        if (rc == 1 && !is_echo(sh, identity_query)) {
            if (is_identity(sh->parser.text) && !answered++) deadline_ns = host_deadline_ns(ANSWERS_MS);
            host_stray_line(sh);
        }
        if (rc == 1) continue;
        if (rc == 0 && sh->ended) return host_over(sh);
        if (rc == 0) rc = deadline_ns < host_deadline_ns(0) ? SH_ETIMEOUT : host_fill(sh, deadline_ns);
        if (rc == SH_ETIMEOUT && answered) break; /* is_late finds the others, if they come after all */
        if (rc != 0) return rc;
    }
    sh->source.unsettled = 0;
    return 0;
}

/* Returns whether a line is the answer to a question of exchange_settle() that comes after all, instead of the reply to
 * this command. */
static int is_late(struct scanhead *sh, const char *command)
{
    if (sh->source.asked == 0 || asks_identity(command) || !is_identity(sh->parser.text)) return 0;
    host_stray_line(sh);
    return 1;
}

/* Skips old replies, before the first exchange on a terminal and after a command that was given up.
 * Between open() and raw mode the terminal echoes what the head sends, and the head takes the echo for commands;
 * another program may have left half a line. So an empty line ends that line, and all replies are skipped up to the
 * answer to a question of our own. The last thing that the head sent to the program before this one may be half a
 * frame. The parser may take the answer for the other half. So the question is asked again. */
static int exchange_settle(struct scanhead *sh, int64_t deadline_ns)
{
    static const char question[] = "\n*IDN?\n";
    for (;;) {
        int rc = send_all(sh, question, sizeof question - 1, deadline_ns);
        if (rc != 0) return rc;
        sh->source.asked++;
        int64_t until_ns = host_deadline_ns(ASK_AGAIN_MS);
        rc = pass_over(sh, until_ns < deadline_ns ? until_ns : deadline_ns);
        const int64_t now_ns = host_deadline_ns(0);
        const int was_signal = sh->has_no_limit && now_ns < until_ns;
        if (rc != SH_ETIMEOUT || now_ns >= deadline_ns || was_signal) return rc;
    }
}

/* The reply may still come, and must not count as the next command's reply. So exchange_settle() runs before the next
 * command. */
static void give_up(struct scanhead *sh, const char *command)
{
    const int asks = asks_identity(command);
    sh->source.unsettled = 1;
    sh->source.asked += asks;
    sh->notices.given_up++;
    sh->notices.identities += (uint64_t)asks;
}

int scanhead_command(struct scanhead *sh, const char *command, char *reply, size_t reply_len, int timeout_ms)
{
    char line[NATIVE_MAX_COMMAND + 1];
    size_t len = strlen(command);
    sh->payload = NULL;
    sh->has_no_limit = timeout_ms < 0;
    int rc = check_command(sh, command, len);
    if (rc != 0) return rc;
    memcpy(line, command, len);
    line[len] = '\n';
    int64_t deadline_ns = host_deadline_ns(timeout_ms);
    rc = discard_stale(sh);
    if (rc == 0 && sh->source.unsettled && !sh->ended) rc = exchange_settle(sh, deadline_ns);
    if (rc == 0) rc = sh->ended ? host_gone(sh) : send_all(sh, line, len + 1, deadline_ns);
    const int is_sent = rc == 0;
    while (rc == 0) {
        rc = take_items(sh);
        if (rc == 1 && (is_echo(sh, command) || is_late(sh, command))) {
            rc = 0;
            continue;
        }
        if (rc == 1) return copy_reply(sh, reply, reply_len);
        if (rc != 0) break;
        if (sh->ended) return host_over(sh);
        rc = deadline_ns < host_deadline_ns(0) ? SH_ETIMEOUT : host_fill(sh, deadline_ns);
    }
    if (is_sent) give_up(sh, command);                  /* also after another error than a time-out */
    if (rc != SH_ETIMEOUT || timeout_ms < 0) return rc; /* no time limit: a signal ended the wait */
    return sh_fail(&sh->err, SCANHEAD_ETIMEOUT, "%s: no reply to '%s' within %d ms", sh->source.name, command,
                   timeout_ms);
}
