/* SPDX-License-Identifier: MIT */
#include "tests/wire/cola_client.h"

const char *cola_client_next(struct cola_client *c)
{
    for (;;) {
        const char *end = memchr(c->bytes, 3, c->len);
        if (end != NULL) {
            const size_t n = (size_t)(end - c->bytes);
            memcpy(c->text, c->bytes + 1, n - 1);
            c->text[n - 1] = '\0';
            memmove(c->bytes, end + 1, c->len -= n + 1);
            return c->text;
        }
        struct pollfd slot = {.fd = c->fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t got = read(c->fd, c->bytes + c->len, sizeof c->bytes - c->len);
        if (got <= 0) return NULL;
        c->len += (size_t)got;
    }
}

void cola_client_send(struct cola_client *c, const char *request)
{
    char line[64];
    raw_send(c->fd, line, (size_t)snprintf(line, sizeof line, "\2%s\3", request));
}

const char *cola_client_ask(struct cola_client *c, const char *request)
{
    const char *answer;
    cola_client_send(c, request);
    while ((answer = cola_client_next(c)) != NULL && strncmp(answer, "sSN ", 4) == 0)
        continue;
    return answer;
}

void cola_client_expect(struct cola_client *c, const char *request, const char *answer)
{
    const char *said = cola_client_ask(c, request);
    assert_non_null(said);
    assert_string_equal(said, answer);
}

void cola_client_reboot(struct cola_client *c, const struct head *head)
{
    cola_client_expect(c, "sMN mSCreboot", "sAN mSCreboot");
    assert_null(cola_client_next(c));
    close(c->fd);
    *c = (struct cola_client){.fd = raw_connect_again(head_endpoint(head, "tcp"), "\2sRN ODpwrc\3")};
    assert_string_equal(cola_client_next(c), "sRA ODpwrc 2");
}
