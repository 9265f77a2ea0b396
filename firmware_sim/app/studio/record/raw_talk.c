/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/raw_talk.h"

#include <string.h>
#include <unistd.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/base/clock.h"

/* The next --send waits until an answer has come and the device was silent for SILENT_MS, at most ANSWER_MS. */
enum { SILENT_MS = 50, ANSWER_MS = 1000, LOOK_MS = 10 };

/* ---- frames */

/* Bytes that a slow reader held back may have come before the last frame. Such bytes get the last frame's time, so that
 * times do not go back. Times go back only where the clock itself was set back. */
static int write_frame(struct talk *talk, int64_t t_ns, const uint8_t *frame, size_t len, size_t payload,
                       struct sh_err *err)
{
    struct raw *r = talk->r;
    if (len == 0) return SH_OK;
    const int is_held = t_ns < r->last_t_ns && stamped_now_ns() >= r->last_t_ns;
    const struct capture_frame f = {.t_ns = is_held ? r->last_t_ns : t_ns, .bytes = frame, .len = len};
    return raw_write(r, &f, payload, err);
}

static int write_bytes(struct talk *talk, int side, int64_t t_ns, const uint8_t *bytes, size_t len, struct sh_err *err)
{
    uint8_t frame[ETHERNET_MAX_HEADERS + ETHERNET_MAX_SEGMENT];
    for (size_t at = 0, n; at < len; at += n) {
        n = len - at < ETHERNET_MAX_SEGMENT ? len - at : ETHERNET_MAX_SEGMENT;
        const size_t frame_len = tcp_put_data(&talk->segments, side, bytes + at, n, frame);
        const int rc = write_frame(talk, t_ns, frame, frame_len, n, err);
        if (rc != SH_OK) return rc;
    }
    return write_frame(talk, t_ns, frame, tcp_put_ack(&talk->segments, !side, frame), 0, err);
}

static int write_end(struct talk *talk, int side, int64_t t_ns, struct sh_err *err)
{
    uint8_t frame[ETHERNET_MAX_HEADERS];
    const int rc = write_frame(talk, t_ns, frame, tcp_put_fin(&talk->segments, side, frame), 0, err);
    return rc != SH_OK ? rc : write_frame(talk, t_ns, frame, tcp_put_ack(&talk->segments, !side, frame), 0, err);
}

static int write_reset(struct talk *talk, int side, int64_t t_ns, struct sh_err *err)
{
    uint8_t frame[ETHERNET_MAX_HEADERS];
    return write_frame(talk, t_ns, frame, tcp_put_reset(&talk->segments, side, frame), 0, err);
}

static int write_handshake(struct talk *talk, int64_t began_ns, struct sh_err *err)
{
    uint8_t frame[ETHERNET_MAX_HEADERS];
    int rc = write_frame(talk, began_ns, frame, tcp_put_syn(&talk->segments, 0, frame), 0, err);
    const int64_t now_ns = stamped_now_ns();
    if (rc == SH_OK) rc = write_frame(talk, now_ns, frame, tcp_put_syn(&talk->segments, 1, frame), 0, err);
    return rc == SH_OK ? write_frame(talk, now_ns, frame, tcp_put_ack(&talk->segments, 0, frame), 0, err) : rc;
}

/* ---- what comes from an end */

/* The other end has taken all that came before. */
static int is_free(const struct talk_end *end)
{
    return end->sent == end->len && !end->is_over;
}

static int raw_talk_take(struct raw_input *input, struct sh_err *err)
{
    struct talk_end *end = (struct talk_end *)input;
    (void)err;
    if (!is_free(end)) return 0;
    const ssize_t n = stamped_read(end->fd, end->bytes, sizeof end->bytes, &input->t_ns);
    if (n == 0) return 0;
    /* Where sending found that the connection broke, reading says only that it is over. */
    end->news = n > 0 ? TALK_BYTES : n == SH_ECLOSED && !end->is_deaf ? TALK_END : TALK_RESET;
    end->len = end->sent = n > 0 ? (size_t)n : 0;
    return 1;
}

static int may_send(const struct talk *talk)
{
    const int64_t now_ns = clock_now_ns();
    if (talk->next_send == 0 || now_ns - talk->sent_ns >= ANSWER_MS * INT64_C(1000000)) return 1;
    return talk->heard_ns > talk->sent_ns && now_ns - talk->heard_ns >= SILENT_MS * INT64_C(1000000);
}

/* End 0 is this program: takes its next --send. */
static int take_send(struct raw_input *input, struct sh_err *err)
{
    struct talk_end *end = (struct talk_end *)input;
    struct talk *talk = end->talk;
    (void)err;
    if (!is_free(end) || talk->next_send == talk->r->n_sends || !may_send(talk)) return 0;
    const struct raw_send *send = &talk->r->send[talk->next_send++];
    memcpy(end->bytes, send->bytes, send->len);
    end->news = TALK_BYTES;
    end->len = end->sent = send->len;
    input->t_ns = stamped_now_ns();
    talk->sent_ns = clock_now_ns();
    return 1;
}

/* ---- what goes on to the other one */

static void push(struct talk_end *end)
{
    struct talk_end *to = &end->talk->end[!end->number];
    while (end->sent < end->len) {
        const ssize_t n =
            to->fd < 0 || to->is_deaf ? SH_ECLOSED : socket_write(to->fd, end->bytes + end->sent, end->len - end->sent);
        if (n == 0) return;
        if (n < 0) {
            to->is_deaf = 1;
            end->sent = end->len;
        } else {
            end->sent += (size_t)n;
        }
    }
}

/* An end that has sent its last byte, and takes no more, breaks the connection, as it would on the wire. */
static int check_deaf(struct talk *talk, struct sh_err *err)
{
    for (int i = 0; i < 2; i++) {
        struct talk_end *end = &talk->end[i], *other = &talk->end[!i];
        if (end->fd < 0 || !end->is_deaf || !end->is_over || talk->is_over) continue;
        if (other->fd >= 0) socket_break(other->fd);
        talk->is_over = talk->was_reset = 1;
        return write_reset(talk, i, stamped_now_ns(), err);
    }
    return SH_OK;
}

static int pass_end(struct talk *talk, struct talk_end *end, struct sh_err *err)
{
    struct talk_end *other = &talk->end[!end->number];
    end->is_over = 1;
    int rc = write_end(talk, end->number, end->input.t_ns, err);
    if (other->fd >= 0)
        shutdown(other->fd, SHUT_WR);
    else if (rc == SH_OK) /* this program has nothing more to say, either */
        rc = write_end(talk, other->number, end->input.t_ns, err);
    talk->is_over = other->fd < 0 || other->is_over;
    return rc;
}

static int pass_reset(struct talk *talk, struct talk_end *end, struct sh_err *err)
{
    struct talk_end *other = &talk->end[!end->number];
    end->is_over = talk->is_over = talk->was_reset = 1;
    if (other->fd >= 0) socket_break(other->fd);
    return write_reset(talk, end->number, end->input.t_ns, err);
}

static int pass(struct raw_input *input, struct sh_err *err)
{
    struct talk_end *end = (struct talk_end *)input;
    struct talk *talk = end->talk;
    if (talk->is_over) return SH_OK;
    if (end->news == TALK_END) return pass_end(talk, end, err);
    if (end->news == TALK_RESET) return pass_reset(talk, end, err);
    const int rc = write_bytes(talk, end->number, input->t_ns, end->bytes, end->len, err);
    if (rc != SH_OK) return rc;
    end->received += end->len;
    if (end->number == 1) talk->heard_ns = clock_now_ns();
    if (end->number == 0 || talk->end[0].fd >= 0) {
        end->sent = 0;
        push(end);
    }
    return check_deaf(talk, err);
}

/* ---- the connection */

static int set_ends(struct talk *talk, int fd)
{
    struct sockaddr_storage own, device;
    socklen_t own_len = sizeof own, device_len = sizeof device;
    if (getsockname(fd, (struct sockaddr *)&own, &own_len) != 0) return SH_EIO;
    if (getpeername(fd, (struct sockaddr *)&device, &device_len) != 0) return SH_EIO;
    talk->segments = (struct tcp_talk){.end = {raw_end_of(&own), raw_end_of(&device)}};
    return SH_OK;
}

int talk_open(struct talk *talk, struct raw *r, const int fd[2], int64_t began_ns, struct sh_err *err)
{
    talk->r = r;
    talk->is_used = 1;
    talk->is_over = talk->was_reset = talk->next_send = 0;
    talk->sent_ns = talk->heard_ns = 0;
    for (int i = 0; i < 2; i++) {
        struct talk_end *end = &talk->end[i];
        end->talk = talk;
        end->number = i;
        end->fd = fd[i];
        end->is_over = end->is_deaf = 0;
        end->len = end->sent = 0;
        end->received = 0;
        end->input = (struct raw_input){.take = fd[i] < 0 ? take_send : raw_talk_take, .pass = pass};
    }
    /* Where the device broke the connection at once, the socket has no address of a peer any more. */
    if (set_ends(talk, fd[1]) != SH_OK)
        return sh_fail(err, SH_ELOST, "%s: the connection was closed at once", r->in.operand[0]);
    return write_handshake(talk, began_ns, err);
}

int talk_wait_for(const struct talk *talk, struct pollfd *fds, int *timeout_ms)
{
    int n = 0;
    for (int i = 0; i < 2; i++) {
        const struct talk_end *end = &talk->end[i], *other = &talk->end[!i];
        const short events = (short)((is_free(end) ? POLLIN : 0) | (other->sent < other->len ? POLLOUT : 0));
        if (end->fd >= 0 && events != 0) fds[n++] = (struct pollfd){.fd = end->fd, .events = events};
    }
    const int waits_to_send = talk->end[0].fd < 0 && talk->next_send < talk->r->n_sends;
    if (waits_to_send && *timeout_ms > LOOK_MS) *timeout_ms = LOOK_MS;
    return n;
}

int talk_push(struct talk *talk, struct sh_err *err)
{
    push(&talk->end[0]);
    push(&talk->end[1]);
    return check_deaf(talk, err);
}

int talk_finish(struct talk *talk, struct sh_err *err)
{
    if (talk->is_over || talk->end[0].is_over) return SH_OK;
    return write_end(talk, 0, stamped_now_ns(), err);
}

void talk_close(struct talk *talk)
{
    for (int i = 0; i < 2 && talk->is_used; i++)
        if (talk->end[i].fd >= 0) close(talk->end[i].fd);
    talk->is_used = 0;
}
