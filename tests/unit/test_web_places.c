/* SPDX-License-Identifier: MIT */
/* These are tests of the choice of the client that makes room at a web link, and of the types of the page's files. */
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <arpa/inet.h>
#include <cmocka.h>
#include <netinet/in.h>

#include "drivers/link/web_pages.h"
#include "drivers/link/web_places.h"

static struct web_place place[WEB_PLACES];
static const struct web_places places = {place, sizeof place[0]};

static void fill(int from, int to, unsigned char address, enum web_phase phase, int64_t since_us)
{
    for (int i = from; i < to; i++) {
        memset(&place[i], 0, sizeof place[i]);
        place[i].phase = phase;
        place[i].address[0] = address;
        place[i].since_us = since_us + i;
    }
}

static int take(unsigned char address, int64_t now_us)
{
    const unsigned char all[8] = {address};
    return web_places_take(places, all, now_us);
}

static void test_who_goes(void **state)
{
    (void)state;
    fill(0, WEB_PLACES, 0, WEB_NOBODY, 0);
    assert_int_equal(take(1, 100), 0);
    fill(0, WEB_PLACES_OF_ONE, 1, WEB_ASKING, 0);
    assert_int_equal(take(2, 100), WEB_PLACES_OF_ONE); /* for others there is room */
    assert_int_equal(take(1, 100), 0);                 /* its own oldest */
    place[7].since_us = -1;
    assert_int_equal(take(1, 100), 7);
    place[9].phase = WEB_LINGERING; /* it has had its answer */
    assert_int_equal(take(1, 100), 9);
    fill(WEB_PLACES_OF_ONE, WEB_PLACES, 2, WEB_ASKING, -100);
    assert_int_equal(take(2, 100), 9); /* of the address that has the most, though others are older */
    assert_int_equal(take(3, 100), 9);
    fill(0, WEB_PLACES_OF_ONE, 1, WEB_TALKING, 0);
    assert_int_equal(take(1, 100), -1); /* sessions stay */
    assert_int_equal(take(3, 100), WEB_PLACES_OF_ONE);
}

/* A client that takes its answer stays. A client that does not is silent. */
static void test_answers(void **state)
{
    (void)state;
    fill(0, WEB_PLACES_OF_ONE, 1, WEB_ANSWERING, 0);
    fill(WEB_PLACES_OF_ONE, WEB_PLACES, 0, WEB_NOBODY, 0);
    assert_int_equal(take(1, 1000 * WEB_GOODBYE_MS - 1), -1);
    assert_int_equal(take(1, 1000 * WEB_GOODBYE_MS), 0);
    assert_int_equal(take(2, 1000 * WEB_GOODBYE_MS - 1), WEB_PLACES_OF_ONE);
}

static void test_addresses(void **state)
{
    (void)state;
    struct sockaddr_storage from = {.ss_family = AF_INET};
    struct sockaddr_in6 *at = (struct sockaddr_in6 *)(void *)&from;
    unsigned char a[8], b[8];
    ((struct sockaddr_in *)(void *)&from)->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    web_address(&from, a);
    memset(&from, 0, sizeof from);
    from.ss_family = AF_INET6;
    assert_int_equal(inet_pton(AF_INET6, "::ffff:127.0.0.1", &at->sin6_addr), 1);
    web_address(&from, b);
    assert_memory_equal(a, b, 8);
    assert_int_equal(inet_pton(AF_INET6, "2001:db8:1:2::3", &at->sin6_addr), 1);
    web_address(&from, a);
    assert_int_equal(inet_pton(AF_INET6, "2001:db8:1:2:ffff::4", &at->sin6_addr), 1); /* one network is one client */
    web_address(&from, b);
    assert_memory_equal(a, b, 8);
    assert_int_equal(inet_pton(AF_INET6, "2001:db8:1:3::3", &at->sin6_addr), 1);
    web_address(&from, b);
    assert_memory_not_equal(a, b, 8);
}

/* Browsers run no script and take no style of another type, since the head sends `nosniff`. */
static void test_types(void **state)
{
    (void)state;
    static const char *const types[][2] = {{"/", "text/html; charset=utf-8"},
                                           {"/index.html", "text/html; charset=utf-8"},
                                           {"/view.js", "text/javascript; charset=utf-8"},
                                           {"/style.css", "text/css; charset=utf-8"},
                                           {"/icon.svg", "image/svg+xml"}};
    struct web_page page;
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        assert_true(web_page_at(types[i][0], &page));
        assert_string_equal(page.type, types[i][1]);
    }
    assert_false(web_page_at("/view", &page));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_who_goes),
        cmocka_unit_test(test_answers),
        cmocka_unit_test(test_addresses),
        cmocka_unit_test(test_types),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
