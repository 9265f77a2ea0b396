/* SPDX-License-Identifier: MIT */
#include "tests/unit/velodyne_http_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

struct protocol_rig http_rig;
struct protocol_rig_reply http_replies[7];

int http_setup(void **state)
{
    (void)state;
    protocol_rig_open(&http_rig, PROTOCOL_VELODYNE_HTTP, "Velodyne", "VLP-16");
    http_replies[0] = (struct protocol_rig_reply){"HEAD:STATE?", "scanning", 0};
    http_replies[1] = (struct protocol_rig_reply){"HEAD:LINES?", "10", 0};
    http_replies[2] = (struct protocol_rig_reply){"SCAN:ECHOES?", "STRongest", 0};
    http_replies[3] = (struct protocol_rig_reply){NULL, NULL, 0};
    http_rig.replies = http_replies;
    return 0;
}

int http_teardown(void **state)
{
    (void)state;
    protocol_rig_close(&http_rig);
    return 0;
}

void http_renew(void)
{
    struct sh_err err;
    protocol_destroy(http_rig.ops, http_rig.protocol);
    assert_int_equal(protocol_create(http_rig.ops, &http_rig.spec, &http_rig.protocol, &err), SH_OK);
    http_rig.ops->open(http_rig.protocol, 0);
    protocol_rig_clear(&http_rig);
    http_rig.hung_up = 0;
    memset(http_rig.count, 0, sizeof http_rig.count);
}

const char *http_answer(void)
{
    http_rig.bytes[http_rig.len] = '\0';
    return (const char *)http_rig.bytes;
}

void http_send(const char *text)
{
    protocol_rig_clear(&http_rig);
    protocol_rig_input(&http_rig, text);
}

void http_post(const char *path, const char *form)
{
    char text[2048];
    snprintf(text, sizeof text,
             "POST %s HTTP/1.1\r\nHost: 127.0.0.1:8080\r\nUser-Agent: curl/7.88.1\r\nAccept: */*\r\n"
             "Content-Length: %zu\r\nContent-Type: application/x-www-form-urlencoded\r\n\r\n%s",
             path, strlen(form), form);
    http_send(text);
}

void http_get(const char *path)
{
    char text[256];
    snprintf(text, sizeof text, "GET %s HTTP/1.1\r\nHost: x\r\n\r\n", path);
    http_send(text);
}

int http_status(void)
{
    int number = 0;
    assert_int_equal(sscanf(http_answer(), "HTTP/1.1 %d ", &number), 1);
    return number;
}

const char *http_body(void)
{
    const char *end = strstr(http_answer(), "\r\n\r\n");
    assert_non_null(end);
    return end + 4;
}

void http_assert_command(const char *line)
{
    const char *found = NULL;
    for (uint32_t i = 0; i < http_rig.n_lines; i++) {
        if (strchr(http_rig.line[i], '?') != NULL) continue;
        assert_null(found);
        found = http_rig.line[i];
    }
    if (line == NULL)
        assert_null(found);
    else
        assert_string_equal(found, line);
}
