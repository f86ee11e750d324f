def main():
    p = get_position("red cube")
    move_to([p[0], p[1], p[2] + 0.1])
    return 0


if __name__ == "__main__":
    main()
    print("main ran")
