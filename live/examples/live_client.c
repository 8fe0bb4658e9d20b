/* Friction in real time over a WebSocket without a library: rows of samples from standard input, newtons to standard output.
 *
 *     cc -std=c99 -O2 -o live_client live_client.c
 *     ./live_client 127.0.0.1 5002 "press 7" 0.005 < rows.csv
 *
 * A row is one line, INPUTS separated by commas, nan where there is none; it prints index,friction,lower,upper,flags.
 * Rows are kept until they are acknowledged and sent again after a break, so that neither a break nor a restart of the
 * service loses one. For little-endian machines with Linux sockets, without TLS and tokens. */
#define _GNU_SOURCE
#include <netdb.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define INPUTS "\"pressure_1_pa\", \"pressure_2_pa\", \"position_m\""
enum { COLUMNS = 3, ROW = 8 * COLUMNS, RING = 1 << 14, BLOCK = 10, MESSAGE = 1 << 23 };
enum { TEXT = 1, FRAMES = 2, CLOSE = 8, PING = 9, PONG = 10 }; /* kinds of WebSocket messages */

struct header { uint8_t kind, columns; uint16_t rows; uint32_t handle; uint64_t index; double time_s; };

static double ring[RING][COLUMNS]; /* the row of index i at i % RING, until it is acknowledged */
static unsigned char message[MESSAGE + 1];
static uint64_t got, sent, kept, printed; /* indices: all rows before it are read, sent, acknowledged, printed */
static uint32_t handle;
static int line = -1;
static double sample_time_s, start_s;

static int put(unsigned char kind, const void *bytes, uint32_t size) /* send a message; 0 when the connection broke */
{
    unsigned char head[14] = {0};
    size_t length = 2, byte, more = size > 65535 ? 8 : size > 125 ? 2 : 0; /* bytes that hold the size */

    head[0] = 0x80 | kind;
    head[1] = 0x80 | (unsigned char)(more == 8 ? 127 : more == 2 ? 126 : size);
    for (byte = more; byte-- > 0;)
        head[length++] = byte < 4 ? (unsigned char)(size >> 8 * byte) : 0;
    length += 4; /* the mask: with zeros the bytes stay as they are */
    return send(line, head, length, MSG_NOSIGNAL | MSG_MORE) == (ssize_t)length
        && send(line, bytes, size, MSG_NOSIGNAL) == (ssize_t)size;
}

static int get(uint32_t *size) /* the next message's kind; 0 when the connection broke or was closed */
{
    unsigned char head[10];
    size_t byte, more;
    uint64_t length;

    if (recv(line, head, 2, MSG_WAITALL) != 2)
        return 0;
    more = head[1] == 127 ? 8 : head[1] == 126 ? 2 : 0;
    if (more && recv(line, head + 2, more, MSG_WAITALL) != (ssize_t)more)
        return 0;
    for (length = more ? 0 : head[1], byte = 0; byte < more; byte++)
        length = length << 8 | head[2 + byte];
    if (length > MESSAGE || recv(line, message, length, MSG_WAITALL) != (ssize_t)length)
        return 0;
    *size = (uint32_t)length;
    message[length] = 0;
    if ((head[0] & 15) == PING)
        put(PONG, message, *size);
    if ((head[0] & 15) == TEXT && !strncmp((char *)message, "{\"error\"", 8))
        exit((fprintf(stderr, "%s\n", (char *)message), 1));
    return (head[0] & 15) == CLOSE ? 0 : head[0] & 15;
}

static int greet(char **given) /* turn the connection into a WebSocket; 0 when the service does not take it */
{
    char text[512];
    size_t length = (size_t)snprintf(text, sizeof text, "GET /stream HTTP/1.1\r\nHost: %s:%s\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n",
        given[1], given[2]);

    if (send(line, text, length, MSG_NOSIGNAL) != (ssize_t)length)
        return 0;
    for (length = 0; length < 4 || memcmp(text + length - 4, "\r\n\r\n", 4); length++)
        if (length == sizeof text || recv(line, text + length, 1, 0) != 1)
            return 0;
    return !memcmp(text, "HTTP/1.1 101", 12);
}

static uint64_t stated(const char *key)
{
    const char *at = strstr((char *)message, key);
    return at ? strtoull(at + strlen(key), NULL, 10) : 0;
}

static void open_session(char **given, int again) /* until it is open; goes on where the service stands */
{
    struct addrinfo wanted = {.ai_socktype = SOCK_STREAM}, *place;
    struct timespec pause = {0, 200000000};
    char text[512], from[24] = "null";
    uint32_t size;
    int kind;

    if (again)
        snprintf(from, sizeof from, "%llu", (unsigned long long)printed);
    snprintf(text, sizeof text, "{\"open\": {\"session\": \"%s\", \"sample_time_s\": %s, \"estimates_from\": %s, "
             "\"inputs\": [" INPUTS "]}}", given[3], given[4], from);
    for (kind = 0; kind != TEXT; nanosleep(&pause, NULL)) {
        close(line);
        if (getaddrinfo(given[1], given[2], &wanted, &place))
            continue;
        line = socket(place->ai_family, SOCK_STREAM, 0);
        if (!connect(line, place->ai_addr, place->ai_addrlen) && greet(given) && put(TEXT, text, (uint32_t)strlen(text)))
            while ((kind = get(&size)) && kind != TEXT) {}
        freeaddrinfo(place);
    }
    handle = (uint32_t)stated("\"handle\": ");
    kept = stated("\"kept_index\": ");
    sent = again ? kept : stated("\"next_index\": ");
    if (again && got - kept > RING)
        exit((fputs("the service has forgotten rows that it had acknowledged\n", stderr), 1));
}

static int send_block(void)
{
    uint64_t rows = got - sent < BLOCK ? got - sent : BLOCK, end = sent + rows;
    struct header head = {1, COLUMNS, (uint16_t)rows, handle, sent, start_s + sample_time_s * (double)sent};
    unsigned char *at = (unsigned char *)memcpy(message, &head, sizeof head) + sizeof head;

    for (; sent < end; sent++, at += ROW)
        memcpy(at, ring[sent % RING], ROW);
    return put(FRAMES, message, (uint32_t)(at - message));
}

static int take(void) /* print estimates, forget acknowledged rows */
{
    unsigned char *at = message;
    struct header head;
    double n[3];
    uint32_t size, flags, row;
    int kind = get(&size);

    while (kind == FRAMES && at < message + size) {
        memcpy(&head, at, sizeof head);
        at += sizeof head;
        if (head.kind == 3)
            kept = head.index;
        for (row = 0; head.kind == 2 && row < head.rows; row++) {
            if (head.index + row < printed)
                continue; /* given again after a break */
            memcpy(n, at + 24 * row, 24), memcpy(&flags, at + 24 * head.rows + 4 * row, 4);
            printf("%llu,%.17g,%.17g,%.17g,%u\n", (unsigned long long)head.index + row, n[0], n[1], n[2], flags);
            printed = head.index + row + 1;
        }
        at += head.kind == 2 ? 24 * head.rows + 4 * (head.rows + head.rows % 2) : 0;
    }
    return kind;
}

static int read_row(void)
{
    double *row = ring[got % RING];

    if (scanf(" %lf,%lf,%lf", row, row + 1, row + 2) == COLUMNS)
        return ++got > 0;
    if (!feof(stdin))
        exit((fprintf(stderr, "row %llu: expected " INPUTS "\n", (unsigned long long)got), 1));
    return 0;
}

int main(int count, char **given)
{
    struct pollfd waits[2] = {{0, POLLIN, 0}, {0, POLLIN, 0}};
    int more = 1, idle, whole;

    if (count != 5)
        return fputs("usage: live_client HOST PORT SESSION SAMPLE_TIME_S < ROWS\n", stderr), 2;
    sample_time_s = atof(given[4]);
    setvbuf(stdin, NULL, _IONBF, 0); /* a line that was read is not hidden from poll */
    open_session(given, 0);
    got = printed = sent;
    start_s = (double)time(NULL) - sample_time_s * (double)sent;
    for (whole = 1; more || kept < got || printed < got; whole = 1) {
        waits[0].fd = line, waits[1].fd = more && got - kept < RING ? 0 : -1;
        idle = !poll(waits, 2, sent < got ? 50 : -1);
        if (waits[0].revents)
            whole = take();
        if (waits[1].fd == 0 && waits[1].revents)
            more = read_row();
        if (whole && (got - sent >= BLOCK || (sent < got && (idle || !more))))
            whole = send_block();
        if (!whole)
            open_session(given, 1);
    }
    return 0;
}
